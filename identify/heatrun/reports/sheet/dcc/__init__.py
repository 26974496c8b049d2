"""The Digital Calibration Certificate (DCC 3.3.0 of PTB): the certificate for machines to read."""
