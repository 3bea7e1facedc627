"""How true, steady and fast lights are, next to other systems': the figures and the chart."""
