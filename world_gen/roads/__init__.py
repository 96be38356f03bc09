"""The road graph: ways cut into edges, what their tags mean, what lies beside them."""
