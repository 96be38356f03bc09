"""The commands on maps and Worlds: fetch, index, list, choose, and write."""
