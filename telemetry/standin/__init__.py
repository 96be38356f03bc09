"""The stand-in car: a multi-body model with its own driver, published as a real car would be.

It is deliberately another model than the twin's, so that a reality gap exists.
"""
