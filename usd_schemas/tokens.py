"""Common names of all layers of a stage: prim paths, attribute names, render variables and material roles."""

WORLD = "/World"
SITE = "/World/Site"
BRIDGE = "/World/Bridge"
BACKGROUND = "/World/Background"
ADDITIONS = "/World/Additions"
ENVIRONMENT = "/World/Environment"
SURVEYS = "/World/Surveys"
RENDER = "/Render"
RENDER_SETTINGS = "/Render/Settings"
RENDER_PRODUCTS = "/Render/Products"
RENDER_VARS = "/Render/Vars"

TIME_CODES_PER_SECOND = 24.0

RENDER_VAR_NAMES = ("rgb", "depth", "semantic", "instance", "normal")
CLASS_NAMES = "falsework:classNames"
CLASS_IDS = "falsework:classIds"
CLASS_COLORS = "falsework:classColors"
TAXONOMY_NAME = "falsework:taxonomy"
LABEL_NAMES = "falsework:labelNames"
LABEL_CLASSES = "falsework:labelClasses"
SEMANTIC_VAR = "/Render/Vars/semantic"

COMPONENT_TAXONOMY = "component"
CLASS_TAXONOMY = "class"

USER_COMPONENT = "userProperties:component"
USER_CLASS = "userProperties:class"
USER_INSTANCE_ID = "userProperties:instanceId"
USER_FALSEWORK_ID = "userProperties:falseworkId"

ROLES = (
    "Role_AbutmentConcrete",
    "Role_PierConcrete",
    "Role_CapConcrete",
    "Role_GirderConcrete",
    "Role_DeckConcrete",
    "Role_ParapetConcrete",
    "Role_KerbConcrete",
    "Role_DeckAsphalt",
    "Role_RoadMarking",
    "Role_BearingRubber",
    "Role_GirderSteel",
    "Role_RailingSteel",
    "Role_CableSteel",
    "Role_RailSteel",
    "Role_SleeperTimber",
    "Role_Ballast",
    "Role_Masonry",
)
