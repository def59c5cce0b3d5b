"""The rotation copy, from which all solving starts; and the roots on the floor and IK handles placed afterwards."""
