"""Changes of a running drive: asked by `foretwin set`, checked, made between rounds, kept."""
