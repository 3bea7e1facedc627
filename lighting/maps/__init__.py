"""Environment maps: what they are, their files, and how pictures become them."""
