"""What compiles kernels."""
