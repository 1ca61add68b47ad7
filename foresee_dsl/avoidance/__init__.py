"""Judges whether a failure could have been avoided, and by which driver; and searches for avoidable failures.

`judge` has the protocol: a judge takes a failure and returns a judgement with an answer and its reason. `judges` lists
those that judge every failure: `r157` (UN Regulation 157's driver) and `anticipating`. `references` runs other drivers
in the place of the failing one. `candidates` searches a run, without a simulation, for other behaviours of actors that
would hit the ego and that a careful driver would avoid."""
