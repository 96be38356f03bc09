"""The vehicle's processes: replay of a drive, and the recorder."""
