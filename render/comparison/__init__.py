"""The estimators side by side: error against time, and pictures at equal time."""
