"""The door of every answer on a sampled loop: an arm and its chain, where it has all of their stages (`arm.stages`)."""

from tfarm.arm import Arm, must_be_arm
from tfarm.arm.chain import Chain, chain_or_usual, stated_keys
from tfarm.arm.stages import Consumer
from tfarm.arm.writing import arm_table
from tfarm.case import Case
from tfarm.dsp.plant import arm_under_chain


def admit(consumer: Consumer, arm: Arm, chain: Chain | None) -> tuple[Arm, Chain]:
    """Return the arm that a chain drives, and that chain, as an answer takes them (`arm_under_chain`).

    Raises ParameterError for a key whose stage the consumer does not have.
    """
    must_be_arm(arm)
    chain = chain_or_usual(chain)
    consumer.refuse_others(arm_table(arm), stated_keys(chain))
    return arm_under_chain(arm, chain)


def admit_case(consumer: Consumer, case: Case) -> Case:
    """Return a case with the arm that its chain drives, as `admit`."""
    arm, chain = admit(consumer, case.arm, case.chain)
    return case if arm is case.arm else case.on(arm).through(chain)


def not_covered(consumer: Consumer, chain: Chain) -> str:
    """Return the end of the line of certainty of a consumer: the keys of its chain that it is without."""
    return consumer.not_covered(stated_keys(chain))
