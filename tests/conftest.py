"""What all tests share."""

from hypothesis import settings

# Properties hold on a busy machine too: an example that takes long is no failure.
settings.register_profile("closedrooms", deadline=None)
settings.load_profile("closedrooms")
