"""The kinds of drivers that `foresee init --driver NAME` writes for bridges (`foresee_dsl.exchange.driver_kinds`)."""
