"""Commands that the page starts, in processes of their own."""
