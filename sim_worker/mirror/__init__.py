"""Roles of several vehicles in one world: moved by physics or as measured, met by others or not."""
