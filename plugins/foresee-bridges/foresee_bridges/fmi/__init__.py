"""Functional Mock-up Units as drivers, `--driver fmi:my_driver.fmu`; docs/guide/fmi.md lists their variables."""
