"""The page of a live session, and examples that follow its lights."""
