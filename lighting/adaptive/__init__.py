"""What the method `adaptive` is made of: key lights, a fill, steady cells, a predicted error."""
