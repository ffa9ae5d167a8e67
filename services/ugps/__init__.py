"""The Underwater GPS of Water Linked: where the vehicle's locator is, by sound."""
