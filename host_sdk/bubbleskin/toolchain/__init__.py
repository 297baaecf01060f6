"""What is built from source: the interpreter the tests run on, and the chip's firmware."""
