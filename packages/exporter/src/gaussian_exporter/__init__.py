"""Trained Gaussian models to ONNX Gaussian Generators."""
