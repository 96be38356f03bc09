"""The worker on another machine: Worlds over the bus, settings by the drive, no path shared."""
