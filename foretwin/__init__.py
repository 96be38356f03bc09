"""foretwin: a low-fidelity digital twin that drives ahead of a real car.

The rooms (`foretwin.contracts`, `foretwin.world_gen` and so on) stand at the top level of the
repository; the links beside this file let an editable install find them under this name.
"""
