"""TDMS measurement files (extra `tdms`)."""
