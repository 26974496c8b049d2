"""The motor file: its tables and keys, what each means, and the data of a certificate.

Begin with `file.load_motor`; `keys` says what each key means.
"""
