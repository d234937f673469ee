"""What the methods of prediction are fitted on, what they are chosen by, and what is reported (never both)."""
