"""Campaigns: thousands of trials of a walk with other numbers in each, and one verdict."""

from heelstrike.experiments.campaigns.campaign import Campaign, Progress
from heelstrike.experiments.campaigns.outcome import Outcome
from heelstrike.experiments.campaigns.parameters import Draw, Share
from heelstrike.experiments.campaigns.results import CampaignResults
from heelstrike.experiments.campaigns.verdict import Bounds, Verdict, proportion, verdict

__all__ = [
    "Bounds",
    "Campaign",
    "CampaignResults",
    "Draw",
    "Outcome",
    "Progress",
    "Share",
    "Verdict",
    "proportion",
    "verdict",
]
