"""Checks of a single file that do not need its network; each module covers one area, and `documents.check_document`
calls all."""
