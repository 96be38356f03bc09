"""Heights: elevation models read from files, and what roads make of them."""
