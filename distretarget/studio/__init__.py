"""The studio: a local page to drop a clip and a character, see and change the result, and download it."""
