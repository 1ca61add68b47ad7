"""The steps of a campaign, one class each: key, work, following steps, stored record.

A new step is a module here with a class of `Step`; `campaign.stages.STEPS` finds it. A step's key contains a hash of
all the code that its module imports, so a step imports only what it runs.
"""
