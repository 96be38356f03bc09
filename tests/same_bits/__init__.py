"""Proves that a reshaping changed no bit: a base revision and the working tree, side by side.

Nothing here imports the product. Each side runs in processes of its own, through the command line;
`injected/` is on their path and writes down what the command line does not tell.
"""
