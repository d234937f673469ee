"""The method of the paper, sections 3.1 to 3.7, a file a step."""
