"""What a command says: while it works, at its end, and in its folder.

- While it works: ``progress``, ``live_recording``, ``log_observer``, ``stopwatch``, ``run_log``.
- At its end: ``run_scores``, ``run_metrics``, ``report``, ``drive_report``, ``manifest``; its files: ``run_directory``.
"""
