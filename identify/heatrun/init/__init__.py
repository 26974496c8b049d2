"""What files hold, and a motor file drafted from them.

Begin with `survey`; `gaps` says what only the user can tell, `draft` writes the file.
"""
