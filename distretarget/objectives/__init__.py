"""What is to be kept, one file a term: contacts, foot lock, other supports, the floor, the paper's distances."""
