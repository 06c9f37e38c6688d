"""What makes a dataset one that others can load: labels, card, metadata, contact sheet and exports."""
