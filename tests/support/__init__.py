"""What tests share: worlds, traces, drivers, checkers."""
