"""The terms that are minimised, a file each: contacts, foot lock, other supports, the floor, the paper's distances."""
