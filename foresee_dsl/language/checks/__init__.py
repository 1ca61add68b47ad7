"""Checks of one file without its network, a module for each area; `documents.check_document` calls them."""
