"""Effects that the machines of a type share: what each says of them, and all of them together."""
