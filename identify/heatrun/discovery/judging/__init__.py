"""What an effect must show before it is believed."""
