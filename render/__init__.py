"""From lights to pictures: shadow-mapped rendering, the session loop and its commands."""
