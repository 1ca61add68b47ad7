"""The kinds of semantic tokens: the server announces them to the client, and answers with their indices."""

from __future__ import annotations

TOKEN_TYPES = ("class", "enumMember", "event", "keyword", "number", "parameter", "string", "struct", "type", "variable")
"""Kinds of semantic tokens, as the protocol names them; a token states its index in this list."""
TOKEN_MODIFIERS = ("declaration",)
"""Properties of semantic tokens; a token states them as bits in this order."""
