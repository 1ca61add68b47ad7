"""Orders of triggers to actors: how each kind of order is carried out, and which orders are in force."""
