"""The learned drivers `fusion` and `fusion_safe`: networks that look at pictures, in ONNX files."""
