"""Policies that were learned: networks in files, as controllers."""
