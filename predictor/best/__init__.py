"""The method ``best``: rectangles between wall faces, chosen jointly by their evidence."""
