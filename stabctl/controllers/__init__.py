"""Control laws and the signals they see."""
