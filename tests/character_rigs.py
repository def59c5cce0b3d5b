"""The joints of rigs that characters come with, and what they are: facts on names and trees, written down by hand."""

from __future__ import annotations

from dataclasses import dataclass

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")


@dataclass(frozen=True)
class Rig:
    """A rig of a person.

    In all names "@" stands for the left or the right, as `sides` has them, and "$" for the first letter of that. `arm`,
    `leg` and `fingers` are the names of the roles of a side, None for a role that no joint has; each finger has its
    bone in the palm, or None, before the others.
    """

    tree: str
    sides: tuple[str, str]
    hips: str
    spine: tuple[str, ...]
    neck: tuple[str, ...]
    head: str
    arm: tuple[str | None, ...]
    leg: tuple[str | None, ...]
    fingers: tuple[tuple[str | None, ...], ...] = ()
    title: str = ""

    @property
    def text(self) -> str:
        """The tree in the words of `named_bodies.tree`, with both sides."""
        return both(self.tree, self.sides)

    def role_names(self) -> dict[str, str]:
        """The name of the joint of each role of limbs and fingers."""
        roles = {}
        for side, mark in zip(("left", "right"), self.sides, strict=True):
            parts = [*zip(("Shoulder", "UpperArm", "LowerArm", "Hand"), self.arm, strict=True)]
            parts += zip(("UpperLeg", "LowerLeg", "Foot", "Toes"), self.leg, strict=True)
            for finger, names in zip(FINGERS, self.fingers, strict=False):
                parts += [(f"{finger}{number}", name) for number, name in enumerate(names)]
            roles |= {side + part: marked(name, mark) for part, name in parts if name}
        return roles


def marked(text: str, side: str) -> str:
    """The text with a side for "@", and its first letter for "$"."""
    return text.replace("@", side).replace("$", side[0])


def both(text: str, sides: tuple[str, str]) -> str:
    """The text, with each part in curly brackets once for the left and once for the right, beside each other."""
    start = text.find("{")
    while start >= 0:
        end, depth = start, 0
        while True:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            if not depth:
                break
            end += 1
        part = text[start + 1 : end]
        text = text[:start] + "|".join(marked(part, side) for side in sides) + text[end + 1 :]
        start = text.find("{")
    return text


def fingers(pattern: str, names: tuple[str, ...], numbers: tuple[object, ...]) -> str:
    """Fingers beside each other: chains of a pattern with `<f>`, the name, and `<n>`, the number."""
    return "|".join(
        ">".join(pattern.replace("<f>", name).replace("<n>", str(number)) for number in numbers) for name in names
    )


def finger_roles(
    pattern: str, names: tuple[str, ...], numbers: tuple[object, ...], palm: str = ""
) -> tuple[tuple[str | None, ...], ...]:
    """The roles of `fingers`, thumb first."""
    rows = []
    for name in names:
        first = palm.replace("<f>", name) if palm and name.lower() != "thumb" else None
        rows.append((first, *(pattern.replace("<f>", name).replace("<n>", str(number)) for number in numbers)))
    return tuple(rows)


FIVE = ("thumb", "index", "middle", "ring", "pinky")
FIVE_CAPITAL = ("Thumb", "Index", "Middle", "Ring", "Pinky")
FIVE_DAZ = ("Thumb", "Index", "Mid", "Ring", "Pinky")
LITTLE = ("Thumb", "Index", "Middle", "Ring", "Little")


def _metahuman_finger(finger: str) -> str:
    first, second, third = (f"{finger}_0{number}" for number in (1, 2, 3))
    return (
        f"{finger}_metacarpal_@({finger}_metacarpal_slide_@|{first}_@({first}_palm_@|{first}_mcp_@|{first}_half_@("
        f"{first}_side_inn_@|{first}_side_out_@|{first}_bulge_@|{first}_palmMid_@)|{second}_@({second}_half_@("
        f"{second}_pip_@|{second}_in_@|{second}_bulge_@|{second}_side_inn_@|{second}_side_out_@|{second}_dip_@)|"
        f"{third}_@({third}_half_@({third}_bulge_@|{third}_in_@)))))"
    )


METAHUMAN_HAND = "|".join(map(_metahuman_finger, FIVE[1:])) + (
    "|thumb_metacarpal_slide_@|thumb_01_@(thumb_01_side_out_@|thumb_01_side_inn_@|thumb_02_@(thumb_02_half_@|"
    "thumb_02_bulge_@|thumb_02_mcp_@|thumb_03_@(thumb_03_half_@|thumb_03_pip_@|thumb_03_bulge_@)))"
    "|wrist_inner_@|wrist_outer_@"
)
METAHUMAN = (
    "root>pelvis(spine_01>spine_02>spine_03>spine_04>spine_05({clavicle_@("
    "clavicle_out_@|clavicle_scap_@|upperarm_@(upperarm_correctiveRoot_@(upperarm_bck_@|upperarm_fwd_@|upperarm_in_@|"
    "upperarm_out_@)|upperarm_twist_01_@>upperarm_twistCor_01_@|upperarm_twist_02_@(upperarm_tricep_@|"
    "upperarm_bicep_@|upperarm_twistCor_02_@)|lowerarm_@(lowerarm_twist_02_@|lowerarm_twist_01_@|"
    "lowerarm_correctiveRoot_@(lowerarm_in_@|lowerarm_out_@|lowerarm_fwd_@|lowerarm_bck_@)|"
    f"hand_@({METAHUMAN_HAND}))))}}|"
    "{clavicle_pec_@|spine_04_latissimus_@}|neck_01(FACIAL_C_Neck1Root({FACIAL_@_NeckB1|FACIAL_@_NeckBackB})|"
    "neck_02(FACIAL_C_Neck2Root({FACIAL_@_NeckA1}|FACIAL_C_AdamsApple|FACIAL_C_NeckBackA)|"
    "head(FACIAL_C_FacialRoot({FACIAL_@_Eye(FACIAL_@_EyelidUpperA|FACIAL_@_EyeParallel)|FACIAL_@_Ear|FACIAL_@_12IPV_NeckA4}|"
    "FACIAL_C_Jaw>FACIAL_C_Chin1|FACIAL_C_Hair1|FACIAL_C_Forehead)))))|"
    "{thigh_@(thigh_twist_01_@>thigh_twistCor_01_@|thigh_twist_02_@>thigh_twistCor_02_@|thigh_correctiveRoot_@("
    "thigh_fwd_@|thigh_bck_@|thigh_in_@|thigh_out_@|thigh_fwd_lwr_@|thigh_bck_lwr_@)|calf_@(calf_twist_02_@>"
    "calf_twistCor_02_@|calf_twist_01_@|calf_correctiveRoot_@(calf_kneeBack_@|calf_knee_@)|foot_@(ankle_bck_@|"
    "ankle_fwd_@|ball_@(bigtoe_01_@>bigtoe_02_@|indextoe_01_@>indextoe_02_@|middletoe_01_@>middletoe_02_@|"
    "littletoe_01_@>littletoe_02_@))))})"
)

CHARACTER_CREATOR = (
    "CC_Base_BoneRoot>CC_Base_Hip(CC_Base_Pelvis({CC_Base_@_Thigh(CC_Base_@_ThighTwist01>CC_Base_@_ThighTwist02|"
    "CC_Base_@_Calf(CC_Base_@_CalfTwist01>CC_Base_@_CalfTwist02|CC_Base_@_KneeShareBone|CC_Base_@_Foot("
    "CC_Base_@_ToeBaseShareBone|CC_Base_@_ToeBase(CC_Base_@_BigToe1|CC_Base_@_IndexToe1|CC_Base_@_MidToe1))))})|"
    "CC_Base_Waist>CC_Base_Spine01>CC_Base_Spine02({CC_Base_@_RibsTwist>CC_Base_@_Breast}|CC_Base_NeckTwist01>"
    "CC_Base_NeckTwist02>CC_Base_Head>CC_Base_FacialBone(CC_Base_JawRoot(CC_Base_Tongue01|CC_Base_Teeth02)|"
    "{CC_Base_@_Eye}|CC_Base_UpperJaw>CC_Base_Teeth01)|{CC_Base_@_Clavicle>CC_Base_@_Upperarm(CC_Base_@_Forearm("
    "CC_Base_@_ForearmTwist01>CC_Base_@_ForearmTwist02|CC_Base_@_ElbowShareBone|CC_Base_@_Hand("
    + fingers("CC_Base_@_<f><n>", FIVE_DAZ, (1, 2, 3))
    + "))|CC_Base_@_UpperarmTwist01>CC_Base_@_UpperarmTwist02)}))"
)

RIGS = {
    "MetaHuman": Rig(
        METAHUMAN,
        ("l", "r"),
        "pelvis",
        tuple(f"spine_0{number}" for number in range(1, 6)),
        ("neck_01", "neck_02"),
        "head",
        ("clavicle_@", "upperarm_@", "lowerarm_@", "hand_@"),
        ("thigh_@", "calf_@", "foot_@", "ball_@"),
        finger_roles("<f>_0<n>_@", FIVE, (1, 2, 3), "<f>_metacarpal_@"),
        "Unreal Engine 5",
    ),
    "Character Creator": Rig(
        CHARACTER_CREATOR,
        ("L", "R"),
        "CC_Base_Hip",
        ("CC_Base_Waist", "CC_Base_Spine01", "CC_Base_Spine02"),
        ("CC_Base_NeckTwist01", "CC_Base_NeckTwist02"),
        "CC_Base_Head",
        ("CC_Base_@_Clavicle", "CC_Base_@_Upperarm", "CC_Base_@_Forearm", "CC_Base_@_Hand"),
        ("CC_Base_@_Thigh", "CC_Base_@_Calf", "CC_Base_@_Foot", "CC_Base_@_ToeBase"),
        finger_roles("CC_Base_@_<f><n>", FIVE_DAZ, (1, 2, 3)),
        "Character Creator",
    ),
    "3ds Max Biped": Rig(
        "Bip001>Bip001 Pelvis>Bip001 Spine({Bip001 @ Thigh(Bip001 @ThighTwist|Bip001 @ Calf>Bip001 @ Foot>"
        "Bip001 @ Toe0>Bip001 @ Toe0Nub)}|Bip001 Spine1>Bip001 Spine2>Bip001 Neck(Bip001 Head>Bip001 HeadNub|"
        "{Bip001 @ Clavicle>Bip001 @ UpperArm(Bip001 @UpArmTwist|Bip001 @ Forearm(Bip001 @ ForeTwist>"
        "Bip001 @ ForeTwist1|Bip001 @ Hand("
        + "|".join(
            f"Bip001 @ Finger{n}>Bip001 @ Finger{n}1>Bip001 @ Finger{n}2>Bip001 @ Finger{n}Nub" for n in range(5)
        )
        + ")))}))",
        ("L", "R"),
        "Bip001 Pelvis",
        ("Bip001 Spine", "Bip001 Spine1", "Bip001 Spine2"),
        ("Bip001 Neck",),
        "Bip001 Head",
        ("Bip001 @ Clavicle", "Bip001 @ UpperArm", "Bip001 @ Forearm", "Bip001 @ Hand"),
        ("Bip001 @ Thigh", "Bip001 @ Calf", "Bip001 @ Foot", "Bip001 @ Toe0"),
        tuple((None, f"Bip001 @ Finger{n}", f"Bip001 @ Finger{n}1", f"Bip001 @ Finger{n}2") for n in range(5)),
        "3ds Max Biped",
    ),
    "Biped with underscores, legs on the pelvis": Rig(
        "Bip01>Bip01_Pelvis({Bip01_@_Thigh>Bip01_@_Calf>Bip01_@_Foot>Bip01_@_Toe0}|Bip01_Spine>Bip01_Spine1>Bip01_Neck("
        "Bip01_Head(Bone_Hair01>Bone_Hair02)|{Bip01_@_Clavicle>Bip01_@_UpperArm>Bip01_@_Forearm>Bip01_@_Hand("
        "Bip01_@_Finger0>Bip01_@_Finger01|Bip01_@_Finger1>Bip01_@_Finger11)}))",
        ("L", "R"),
        "Bip01_Pelvis",
        ("Bip01_Spine", "Bip01_Spine1"),
        ("Bip01_Neck",),
        "Bip01_Head",
        ("Bip01_@_Clavicle", "Bip01_@_UpperArm", "Bip01_@_Forearm", "Bip01_@_Hand"),
        ("Bip01_@_Thigh", "Bip01_@_Calf", "Bip01_@_Foot", "Bip01_@_Toe0"),
        ((None, "Bip01_@_Finger0", "Bip01_@_Finger01"), (None, "Bip01_@_Finger1", "Bip01_@_Finger11")),
        "3ds Max Biped",
    ),
    "Ready Player Me": Rig(
        "Armature>Hips(Spine>Spine1>Spine2(Neck>Head(HeadTop_End|LeftEye|RightEye)|{@Shoulder>@Arm>@ForeArm>@Hand("
        + fingers("@Hand<f><n>", FIVE_CAPITAL, (1, 2, 3, 4))
        + ")})|{@UpLeg>@Leg>@Foot>@ToeBase>@Toe_End})",
        ("Left", "Right"),
        "Hips",
        ("Spine", "Spine1", "Spine2"),
        ("Neck",),
        "Head",
        ("@Shoulder", "@Arm", "@ForeArm", "@Hand"),
        ("@UpLeg", "@Leg", "@Foot", "@ToeBase"),
        finger_roles("@Hand<f><n>", FIVE_CAPITAL, (1, 2, 3)),
        "Mixamo",
    ),
    "VRoid": Rig(
        "Root(J_Bip_C_Hips({J_Sec_@_SkirtBack0_01>J_Sec_@_SkirtBack1_01|J_Sec_@_CoatSkirtFront_01}|J_Bip_C_Spine>"
        "J_Bip_C_Chest>J_Bip_C_UpperChest("
        "{J_Sec_@_Bust1>J_Sec_@_Bust2}|J_Bip_C_Neck>J_Bip_C_Head({J_Adj_@_FaceEye}|J_Sec_Hair1_01>J_Sec_Hair2_01>"
        "J_Sec_Hair3_01|J_Sec_Hair1_02>J_Sec_Hair2_02|J_Sec_Hair1_03|J_Sec_Hair1_04|J_Sec_Hair1_05)|"
        "{J_Bip_@_Shoulder>J_Bip_@_UpperArm(J_Sec_@_TopsUpperArmInside_01|J_Bip_@_LowerArm>J_Bip_@_Hand("
        + fingers("J_Bip_@_<f><n>", LITTLE, (1, 2, 3))
        + "))})|{J_Bip_@_UpperLeg>J_Bip_@_LowerLeg>J_Bip_@_Foot>J_Bip_@_ToeBase})|Face|Body|Hair001)",
        ("L", "R"),
        "J_Bip_C_Hips",
        ("J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_UpperChest"),
        ("J_Bip_C_Neck",),
        "J_Bip_C_Head",
        ("J_Bip_@_Shoulder", "J_Bip_@_UpperArm", "J_Bip_@_LowerArm", "J_Bip_@_Hand"),
        ("J_Bip_@_UpperLeg", "J_Bip_@_LowerLeg", "J_Bip_@_Foot", "J_Bip_@_ToeBase"),
        finger_roles("J_Bip_@_<f><n>", LITTLE, (1, 2, 3)),
        "VRoid",
    ),
    "VRM's own names": Rig(
        "hips(spine>chest>upperChest(neck>head(leftEye|rightEye|jaw)|{@Shoulder>@UpperArm>@LowerArm>@Hand("
        "@ThumbMetacarpal>@ThumbProximal>@ThumbDistal|"
        + fingers("@<f><n>", LITTLE[1:], ("Proximal", "Intermediate", "Distal"))
        + ")})|{@UpperLeg>@LowerLeg>@Foot>@Toes})",
        ("left", "right"),
        "hips",
        ("spine", "chest", "upperChest"),
        ("neck",),
        "head",
        ("@Shoulder", "@UpperArm", "@LowerArm", "@Hand"),
        ("@UpperLeg", "@LowerLeg", "@Foot", "@Toes"),
        (
            (None, "@ThumbMetacarpal", "@ThumbProximal", "@ThumbDistal"),
            *finger_roles("@<f><n>", LITTLE[1:], ("Proximal", "Intermediate", "Distal")),
        ),
        "VRM",
    ),
    "Unity's names with spaces": Rig(
        "Hips(Spine>Chest>Upper Chest(Neck>Head(Left Eye|Right Eye|Jaw)|{@ Shoulder>@ Upper Arm>@ Lower Arm>@ Hand("
        + fingers("@ <f> <n>", LITTLE, ("Proximal", "Intermediate", "Distal"))
        + ")})|{@ Upper Leg>@ Lower Leg>@ Foot>@ Toes})",
        ("Left", "Right"),
        "Hips",
        ("Spine", "Chest", "Upper Chest"),
        ("Neck",),
        "Head",
        ("@ Shoulder", "@ Upper Arm", "@ Lower Arm", "@ Hand"),
        ("@ Upper Leg", "@ Lower Leg", "@ Foot", "@ Toes"),
        finger_roles("@ <f> <n>", LITTLE, ("Proximal", "Intermediate", "Distal")),
        "VRM",
    ),
    "Daz Genesis 8": Rig(
        "Genesis8Female>hip(pelvis({@ThighBend>@ThighTwist>@Shin>@Foot(@Metatarsals|@Heel|@Toe(@BigToe>@BigToe_2|"
        "@SmallToe1>@SmallToe1_2))})|abdomenLower>abdomenUpper>chestLower({@Pectoral}|chestUpper(neckLower>neckUpper>"
        "head(upperTeeth|lowerJaw(lowerTeeth|tongue01>tongue02)|{@Eye|@Ear}|lowerFaceRig>LipUpperMiddle)|"
        "{@Collar>@ShldrBend>@ShldrTwist>@ForearmBend>@ForearmTwist>@Hand(@Thumb1>@Thumb2>@Thumb3|@Carpal1>@Index1>"
        "@Index2>@Index3|@Carpal2>@Mid1>@Mid2>@Mid3|@Carpal3>@Ring1>@Ring2>@Ring3|@Carpal4>@Pinky1>@Pinky2>@Pinky3)})))",
        ("l", "r"),
        "hip",
        ("abdomenLower", "abdomenUpper", "chestLower", "chestUpper"),
        ("neckLower", "neckUpper"),
        "head",
        ("@Collar", "@ShldrBend", "@ForearmBend", "@Hand"),
        ("@ThighBend", "@Shin", "@Foot", "@Toe"),
        (
            (None, "@Thumb1", "@Thumb2", "@Thumb3"),
            *((f"@Carpal{n}", *(f"@{f}{k}" for k in (1, 2, 3))) for n, f in enumerate(FIVE_DAZ[1:], start=1)),
        ),
        "Daz Genesis 3, 8",
    ),
    "Daz Genesis 9": Rig(
        "Genesis9>hip(pelvis({@_thigh(@_thightwist1|@_thightwist2|@_shin>@_foot(@_metatarsal|@_toes(@_bigtoe1>@_bigtoe2|"
        "@_indextoe1>@_indextoe2|@_midtoe1|@_ringtoe1|@_pinkytoe1)))})|spine1>spine2>spine3({@_pectoral}|spine4(neck1>"
        "neck2>head({@_eye|@_ear}|upperteeth|lowerjaw(lowerteeth|tongue01>tongue02)|lowerfacerig|upperfacerig)|"
        "{@_shoulder>@_upperarm(@_upperarmtwist1|@_upperarmtwist2|@_forearm(@_forearmtwist1|@_forearmtwist2|@_hand("
        "@_thumb1>@_thumb2>@_thumb3|@_indexmetacarpal>@_index1>@_index2>@_index3|@_midmetacarpal>@_mid1>@_mid2>@_mid3|"
        "@_ringmetacarpal>@_ring1>@_ring2>@_ring3|@_pinkymetacarpal>@_pinky1>@_pinky2>@_pinky3)))})))",
        ("l", "r"),
        "hip",
        ("spine1", "spine2", "spine3", "spine4"),
        ("neck1", "neck2"),
        "head",
        ("@_shoulder", "@_upperarm", "@_forearm", "@_hand"),
        ("@_thigh", "@_shin", "@_foot", "@_toes"),
        finger_roles("@_<f><n>", ("thumb", "index", "mid", "ring", "pinky"), (1, 2, 3), "@_<f>metacarpal"),
        "Daz Genesis 9",
    ),
    "Second Life": Rig(
        "mPelvis(PELVIS|BUTT|mSpine1>mSpine2>mTorso(BELLY|LEFT_HANDLE|RIGHT_HANDLE|LOWER_BACK|mSpine3>mSpine4>mChest("
        "CHEST|LEFT_PEC|RIGHT_PEC|UPPER_BACK|mNeck(NECK|mHead(HEAD|mSkull|mEyeRight|mEyeLeft|mFaceRoot(mFaceJaw>"
        "mFaceTongueBase|mFaceTeethUpper>mFaceLipUpperLeft|mFaceEar1Left|mFaceEar1Right)))|{mCollar@($_CLAVICLE|"
        "mShoulder@($_UPPER_ARM|mElbow@($_LOWER_ARM|mWrist@($_HAND|"
        + fingers("mHand<f><n>@", FIVE_CAPITAL, (1, 2, 3))
        + "))))}|mWingsRoot({mWing1@>mWing2@>mWing3@>mWing4@})))|{mHip@($_UPPER_LEG|mKnee@($_LOWER_LEG|mAnkle@("
        "$_FOOT|mFoot@>mToe@)))}|mTail1>mTail2>mTail3|mGroin|mHindLimbsRoot({mHindLimb1@>mHindLimb2@>mHindLimb3@}))",
        ("Left", "Right"),
        "mPelvis",
        ("mSpine1", "mSpine2", "mTorso", "mSpine3", "mSpine4", "mChest"),
        ("mNeck",),
        "mHead",
        ("mCollar@", "mShoulder@", "mElbow@", "mWrist@"),
        ("mHip@", "mKnee@", "mAnkle@", "mFoot@"),
        finger_roles("mHand<f><n>@", FIVE_CAPITAL, (1, 2, 3)),
        "Second Life",
    ),
    "MikuMikuDance in English": Rig(
        "root>center(groove>waist(upper body>upper body2(neck>head({eye_@}|eyes|hair1>hair2)|{shoulderP_@>shoulder_@>"
        "shoulderC_@>arm_@(arm twist_@(arm twist1_@|arm twist2_@)|elbow_@(wrist twist_@|wrist_@("
        "thumb0_@>thumb1_@>thumb2_@|fore1_@>fore2_@>fore3_@|middle1_@>middle2_@>middle3_@|"
        "third1_@>third2_@>third3_@|little1_@>little2_@>little3_@|dummy_@)))})|"
        "lower body({leg_@>knee_@>ankle_@>toe2_@}))|"
        "{leg IKP_@>leg IK_@>toe IK_@})",
        ("L", "R"),
        "waist",
        ("upper body", "upper body2"),
        ("neck",),
        "head",
        ("shoulder_@", "arm_@", "elbow_@", "wrist_@"),
        ("leg_@", "knee_@", "ankle_@", "toe2_@"),
        (
            (None, "thumb0_@", "thumb1_@", "thumb2_@"),
            *finger_roles("<f><n>_@", ("fore", "middle", "third", "little"), (1, 2, 3)),
        ),
        "MikuMikuDance, English",
    ),
    "VRChat avatars made of MMD models": Rig(
        "Hips({@ leg>@ knee>@ ankle>@ toe}|Spine>Chest({@ shoulder>@ arm>@ elbow>@ wrist(Thumb0_$>Thumb1_$>Thumb2_$|"
        "IndexFinger1_$>IndexFinger2_$>IndexFinger3_$|MiddleFinger1_$>MiddleFinger2_$|RingFinger1_$>RingFinger2_$|"
        "LittleFinger1_$>LittleFinger2_$)}|Neck>Head(Hair1>Hair2|Eye_L|Eye_R))|Skirt1)",
        ("Left", "Right"),
        "Hips",
        ("Spine", "Chest"),
        ("Neck",),
        "Head",
        ("@ shoulder", "@ arm", "@ elbow", "@ wrist"),
        ("@ leg", "@ knee", "@ ankle", "@ toe"),
        (
            (None, "Thumb0_$", "Thumb1_$", "Thumb2_$"),
            (None, "IndexFinger1_$", "IndexFinger2_$", "IndexFinger3_$"),
            *((None, f"{finger}Finger1_$", f"{finger}Finger2_$") for finger in LITTLE[2:]),
        ),
        "VRChat",
    ),
    "Rigify's metarig": Rig(
        "spine(spine.001>spine.002>spine.003(spine.004>spine.005>spine.006>face(nose|{eye.@|ear.@}|jaw>chin|teeth.T)|"
        "{shoulder.@>upper_arm.@>forearm.@>hand.@(palm.01.@(f_index.01.@>f_index.02.@>f_index.03.@|thumb.01.@>thumb.02.@>"
        "thumb.03.@)|palm.02.@>f_middle.01.@>f_middle.02.@>f_middle.03.@|palm.03.@>f_ring.01.@>f_ring.02.@>f_ring.03.@|"
        "palm.04.@>f_pinky.01.@>f_pinky.02.@>f_pinky.03.@)|breast.@})|{pelvis.@|thigh.@>shin.@>foot.@(toe.@|heel.02.@)})",
        ("L", "R"),
        "spine",
        ("spine.001", "spine.002", "spine.003"),
        ("spine.004", "spine.005"),
        "spine.006",
        ("shoulder.@", "upper_arm.@", "forearm.@", "hand.@"),
        ("thigh.@", "shin.@", "foot.@", "toe.@"),
        (
            (None, "thumb.01.@", "thumb.02.@", "thumb.03.@"),
            *((f"palm.0{n}.@", *(f"f_{f}.0{k}.@" for k in (1, 2, 3))) for n, f in enumerate(FIVE[1:], start=1)),
        ),
        "Rigify",
    ),
    "deforming bones alone, limbs in two": Rig(
        "root>DEF-spine(DEF-spine.001>DEF-spine.002>DEF-spine.003(DEF-spine.004>DEF-spine.005>DEF-spine.006|"
        "{DEF-shoulder.@>DEF-upper_arm.@>DEF-upper_arm.@.001>DEF-forearm.@>DEF-forearm.@.001>DEF-hand.@("
        "DEF-palm.01.@(DEF-f_index.01.@>DEF-f_index.02.@>DEF-f_index.03.@|DEF-thumb.01.@>DEF-thumb.02.@>DEF-thumb.03.@)|"
        "DEF-palm.02.@>DEF-f_middle.01.@>DEF-f_middle.02.@>DEF-f_middle.03.@)|DEF-breast.@})|{DEF-pelvis.@|"
        "DEF-thigh.@>DEF-thigh.@.001>DEF-shin.@>DEF-shin.@.001>DEF-foot.@>DEF-toe.@})",
        ("L", "R"),
        "DEF-spine",
        ("DEF-spine.001", "DEF-spine.002", "DEF-spine.003"),
        ("DEF-spine.004", "DEF-spine.005"),
        "DEF-spine.006",
        ("DEF-shoulder.@", "DEF-upper_arm.@", "DEF-forearm.@", "DEF-hand.@"),
        ("DEF-thigh.@", "DEF-shin.@", "DEF-foot.@", "DEF-toe.@"),
        (
            (None, "DEF-thumb.01.@", "DEF-thumb.02.@", "DEF-thumb.03.@"),
            *(
                (f"DEF-palm.0{n}.@", *(f"DEF-f_{f}.0{k}.@" for k in (1, 2, 3)))
                for n, f in ((1, "index"), (2, "middle"))
            ),
        ),
        "Rigify",
    ),
    "Rigify before 2019": Rig(
        "root>DEF-hips(DEF-spine>DEF-chest(DEF-neck>DEF-head|{DEF-shoulder.@>DEF-upper_arm.01.@>DEF-upper_arm.02.@>"
        "DEF-forearm.01.@>DEF-forearm.02.@>DEF-hand.@>DEF-palm.01.@>DEF-f_index.01.@>DEF-f_index.02.@})|"
        "{DEF-thigh.01.@>DEF-thigh.02.@>DEF-shin.01.@>DEF-shin.02.@>DEF-foot.@>DEF-toe.@})",
        ("L", "R"),
        "DEF-hips",
        ("DEF-spine", "DEF-chest"),
        ("DEF-neck",),
        "DEF-head",
        ("DEF-shoulder.@", "DEF-upper_arm.01.@", "DEF-forearm.01.@", "DEF-hand.@"),
        ("DEF-thigh.01.@", "DEF-shin.01.@", "DEF-foot.@", "DEF-toe.@"),
        ((), ("DEF-palm.01.@", "DEF-f_index.01.@", "DEF-f_index.02.@")),
        "Rigify",
    ),
    "XNALara": Rig(
        "root ground>root hips(pelvis({leg @ thigh>leg @ knee>leg @ ankle>leg @ toes})|spine lower>spine middle>"
        "spine upper(head neck lower>head neck upper(head jaw|head eyeball left|head eyeball right|head hair front)|"
        "{arm @ shoulder 1>arm @ shoulder 2(arm @ shoulder 2 twist|arm @ elbow>arm @ wrist("
        "arm @ finger 1a>arm @ finger 1b>arm @ finger 1c|arm @ finger 2a>arm @ finger 2b>arm @ finger 2c))}))",
        ("left", "right"),
        "root hips",
        ("spine lower", "spine middle", "spine upper"),
        ("head neck lower",),
        "head neck upper",
        ("arm @ shoulder 1", "arm @ shoulder 2", "arm @ elbow", "arm @ wrist"),
        ("leg @ thigh", "leg @ knee", "leg @ ankle", "leg @ toes"),
        tuple((None, *(f"arm @ finger {number}{letter}" for letter in "abc")) for number in (1, 2)),
        "XNALara",
    ),
    "VRoid under another program's prefix": Rig(
        "Hero_Root>Hero_J_Bip_C_Hips(Hero_J_Bip_C_Spine>Hero_J_Bip_C_Chest(Hero_J_Bip_C_Neck>Hero_J_Bip_C_Head|"
        "{Hero_J_Bip_@_Shoulder>Hero_J_Bip_@_UpperArm>Hero_J_Bip_@_LowerArm>Hero_J_Bip_@_Hand})|"
        "{Hero_J_Bip_@_UpperLeg>Hero_J_Bip_@_LowerLeg>Hero_J_Bip_@_Foot>Hero_J_Bip_@_ToeBase})",
        ("L", "R"),
        "Hero_J_Bip_C_Hips",
        ("Hero_J_Bip_C_Spine", "Hero_J_Bip_C_Chest"),
        ("Hero_J_Bip_C_Neck",),
        "Hero_J_Bip_C_Head",
        tuple(f"Hero_J_Bip_@_{part}" for part in ("Shoulder", "UpperArm", "LowerArm", "Hand")),
        tuple(f"Hero_J_Bip_@_{part}" for part in ("UpperLeg", "LowerLeg", "Foot", "ToeBase")),
        title="VRoid",
    ),
    "Rigify for games, without dots": Rig(
        "root>DEF-hips(DEF-spine001>DEF-spine002>DEF-spine003(DEF-neck>DEF-head|{DEF-shoulder@>DEF-upper_arm@>DEF-forearm@>"
        "DEF-hand@(" + fingers("DEF-f_<f>0<n>@", FIVE[1:], (1, 2, 3)) + "|DEF-thumb01@>DEF-thumb02@>DEF-thumb03@)})|"
        "{DEF-thigh@>DEF-shin@>DEF-foot@>DEF-toe@})",
        ("L", "R"),
        "DEF-hips",
        ("DEF-spine001", "DEF-spine002", "DEF-spine003"),
        ("DEF-neck",),
        "DEF-head",
        ("DEF-shoulder@", "DEF-upper_arm@", "DEF-forearm@", "DEF-hand@"),
        ("DEF-thigh@", "DEF-shin@", "DEF-foot@", "DEF-toe@"),
        ((None, "DEF-thumb01@", "DEF-thumb02@", "DEF-thumb03@"), *finger_roles("DEF-f_<f>0<n>@", FIVE[1:], (1, 2, 3))),
        "Rigify",
    ),
    "Sketchfab's numbers": Rig(
        "_rootJoint>Hips_01({thigh.@_076>shin.@_077>foot.@_078>toe.@_079>toe.@_end_0101}|Spine_02>Chest_03(Neck_04>"
        "Head_05(Head_end_080|Hair_06>Hair.001_07)|{shoulder.@_032>upper_arm.@_00>forearm.@_034>hand.@_035("
        "thumb.01.@_038>thumb.02.@_039>thumb.02.@_end_081|f_index.01.@_036>f_index.02.@_00>f_index.03.@_037)}))",
        ("L", "R"),
        "Hips_01",
        ("Spine_02", "Chest_03"),
        ("Neck_04",),
        "Head_05",
        ("shoulder.@_032", "upper_arm.@_00", "forearm.@_034", "hand.@_035"),
        ("thigh.@_076", "shin.@_077", "foot.@_078", "toe.@_079"),
        ((None, "thumb.01.@_038", "thumb.02.@_039"), (None, "f_index.01.@_036", "f_index.02.@_00", "f_index.03.@_037")),
    ),
    "Sketchfab's Mixamo": Rig(
        "_rootJoint>mixamorig:Hips_01(mixamorig:Spine_02>mixamorig:Spine1_03>mixamorig:Spine2_04(mixamorig:Neck_05>"
        "mixamorig:Head_06>mixamorig:HeadTop_End_07|{mixamorig:@Shoulder_08>mixamorig:@Arm_00>mixamorig:@ForeArm_010>"
        "mixamorig:@Hand_011(mixamorig:@HandThumb1_012>mixamorig:@HandThumb2_013>mixamorig:@HandThumb3_014>"
        "mixamorig:@HandThumb4_015)})|{mixamorig:@UpLeg_055>mixamorig:@Leg_056>mixamorig:@Foot_057>"
        "mixamorig:@ToeBase_058>mixamorig:@Toe_End_059})",
        ("Left", "Right"),
        "mixamorig:Hips_01",
        ("mixamorig:Spine_02", "mixamorig:Spine1_03", "mixamorig:Spine2_04"),
        ("mixamorig:Neck_05",),
        "mixamorig:Head_06",
        ("mixamorig:@Shoulder_08", "mixamorig:@Arm_00", "mixamorig:@ForeArm_010", "mixamorig:@Hand_011"),
        ("mixamorig:@UpLeg_055", "mixamorig:@Leg_056", "mixamorig:@Foot_057", "mixamorig:@ToeBase_058"),
        ((None, *(f"mixamorig:@HandThumb{n}_01{n + 1}" for n in (1, 2, 3))),),
        "Mixamo",
    ),
    "copied in Blender": Rig(
        "Hips.001(Spine.001>Chest.001(Neck.001>Head.001|{Shoulder.@.001>UpperArm.@.001>LowerArm.@.001>Hand.@.001("
        "Index1.@.001>Index2.@.001>Index3.@.001)})|{UpperLeg.@.001>LowerLeg.@.001>Foot.@.001>Toes.@.001})",
        ("L", "R"),
        "Hips.001",
        ("Spine.001", "Chest.001"),
        ("Neck.001",),
        "Head.001",
        ("Shoulder.@.001", "UpperArm.@.001", "LowerArm.@.001", "Hand.@.001"),
        ("UpperLeg.@.001", "LowerLeg.@.001", "Foot.@.001", "Toes.@.001"),
        ((), (None, "Index1.@.001", "Index2.@.001", "Index3.@.001")),
        "VRM",
    ),
    "MikuMikuDance with bones that copy the legs": Rig(
        "全ての親>センター>グルーブ>腰(上半身>上半身2(首>頭({@目}|両目)|{@肩P>@肩>@肩C>@腕>@腕捩>@ひじ>@手捩>@手首(@親指０>@親指１>@親指２|"
        "@人指１>@人指２>@人指３|@中指１>@中指２>@中指３)})|下半身({@足>@ひざ>@足首>@つま先|腰キャンセル@>@足D>@ひざD>@足首D>@足先EX}))",
        ("左", "右"),
        "腰",
        ("上半身", "上半身2"),
        ("首",),
        "頭",
        ("@肩", "@腕", "@ひじ", "@手首"),
        ("@足D", "@ひざD", "@足首D", "@足先EX"),
        (
            (None, "@親指０", "@親指１", "@親指２"),
            (None, "@人指１", "@人指２", "@人指３"),
            (None, "@中指１", "@中指２", "@中指３"),
        ),
        "MikuMikuDance",
    ),
    "a rigging service, its spine counted downwards": Rig(
        "Armature>Hips(Spine02>Spine01>Spine(neck>Head(head_end|headfront)|{@Shoulder>@Arm>@ForeArm>@Hand})|"
        "{@UpLeg>@Leg>@Foot>@ToeBase})",
        ("Left", "Right"),
        "Hips",
        ("Spine02", "Spine01", "Spine"),
        ("neck",),
        "Head",
        ("@Shoulder", "@Arm", "@ForeArm", "@Hand"),
        ("@UpLeg", "@Leg", "@Foot", "@ToeBase"),
        title="HumanIK (MotionBuilder)",
    ),
    "a rigging service with Character Creator's words": Rig(
        "Root>Hip(Pelvis({@_Thigh(@_ThighTwist01>@_ThighTwist02|@_Calf(@_CalfTwist01|@_Foot>@_ToeBase))})|Waist>Spine01>"
        "Spine02(NeckTwist01>NeckTwist02>Head|{@_Clavicle>@_Upperarm(@_UpperarmTwist01>@_UpperarmTwist02|@_Forearm("
        "@_ForearmTwist01|@_Hand))}))",
        ("L", "R"),
        "Hip",
        ("Waist", "Spine01", "Spine02"),
        ("NeckTwist01", "NeckTwist02"),
        "Head",
        ("@_Clavicle", "@_Upperarm", "@_Forearm", "@_Hand"),
        ("@_Thigh", "@_Calf", "@_Foot", "@_ToeBase"),
        title="Character Creator",
    ),
    "KayKit": Rig(
        "Rig>root(hips(spine>chest(head|{upperarm.@>lowerarm.@>wrist.@>hand.@>handslot.@})|{upperleg.@>lowerleg.@>foot.@>"
        "toes.@})|{kneeIK.@|control-toe-roll.@>control-heel-roll.@>control-foot-roll.@|IK-foot.@|IK-toe.@|elbowIK.@|"
        "handIK.@})",
        ("l", "r"),
        "hips",
        ("spine", "chest"),
        (),
        "head",
        (None, "upperarm.@", "lowerarm.@", "hand.@"),
        ("upperleg.@", "lowerleg.@", "foot.@", "toes.@"),
    ),
}
