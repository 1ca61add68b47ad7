"""How the classes of the model are written: statements (`layout`) and their parts (`phrases`)."""
