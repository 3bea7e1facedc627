"""What ways to a picture are worth: errors as numbers and as eyes see them, against time."""
