"""Could a failure have been avoided, and by which driver? Judges of failures, and the search for avoidable ones.

`judge` has the protocol: a judge takes a failure and returns a judgement with an answer and its reason. `judges` lists
those that are asked about every failure: `r157` (UN Regulation 157's driver) and `anticipating`. `references` are other
drivers in the place of the one that fails. `candidates` looks, before anything is driven, for what actors could do
otherwise and a careful driver would avoid.
"""
