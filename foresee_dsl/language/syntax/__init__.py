"""Text to tree to model: the grammar's parser, nodes with places, comments; and what is said of a broken file."""
