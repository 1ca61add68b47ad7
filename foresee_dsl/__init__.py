"""Traffic situations as text: compile, simulate, forecast near misses, and keep the failures that hide behind them."""

__version__ = "0.1.0"
