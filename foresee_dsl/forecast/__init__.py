"""Where could a run that passed have failed? One protocol, many rankers; they see traces, never the world."""
