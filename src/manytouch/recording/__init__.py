"""How frames, readings and sensors are written into a recording and read back."""
