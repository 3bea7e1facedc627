"""Made scenes whose truth is known: a simulated camera, skies that change, a map like outdoors."""
