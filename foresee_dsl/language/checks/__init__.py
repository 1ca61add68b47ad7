"""What can be said about a file without its network, one module an area; `documents.check_document` calls them."""
