"""The server of the live view: who may ask, what is answered, how it ends."""
