"""A visitor at work on a map, without a browser.

``session`` is one visitor, ``sheet`` the map that all visitors share, ``document`` what they change, ``snapping`` where
a door goes, ``drafts`` what is kept until it is saved, ``settings_form`` the settings of a method as rows.
"""
