"""Text to tree to model: the grammar's parser, nodes with places, comments; and the errors of a broken file."""
