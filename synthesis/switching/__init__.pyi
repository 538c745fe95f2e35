from synthesis.switching.dwell_time import dwell_time as dwell_time
from synthesis.switching.listed import ListedBound as ListedBound
from synthesis.switching.listed import growth_rate as growth_rate
from synthesis.switching.listed import listed_gain as listed_gain
from synthesis.switching.listed_feedback import ListedFeedback as ListedFeedback
from synthesis.switching.listed_feedback import listed_feedback as listed_feedback
from synthesis.switching.switched import SwitchedController as SwitchedController
from synthesis.switching.switched import switched as switched
