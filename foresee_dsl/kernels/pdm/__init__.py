"""The kernels of the driver `pdm`, which `idm` and `frenetix` share: from tracks to the proposal that is driven."""
