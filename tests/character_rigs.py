"""The joints of rigs that characters come with, and what they are: facts on names and trees, written down by hand."""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")


@dataclass(frozen=True)
class Rig:
    """A rig of a person.

    Its tree is in the words of `named_bodies.tree`, with "=" and its role behind each joint that has one; all joints of
    spine and neck have this as their role. Parts in curly brackets are there once for the left and once for the right,
    beside each other; in their names "@" stands for the side, as `sides` has it, and "$" for its first letter. `title`
    is that of its convention.
    """

    tree: str
    sides: tuple[str, str]
    title: str = ""

    @property
    def text(self) -> str:
        """The tree with both sides, without roles."""
        return re.sub("=[^()|>]+", "", self._both)

    @property
    def roles(self) -> dict[str, list[str]]:
        """The names of the joints of each role; those of limbs and fingers begin with their side."""
        names = defaultdict(list)
        for name, role in re.findall("([^()|>]+)=([^()|>]+)", self._both):
            names[role].append(name)
        return dict(names)

    @property
    def _both(self) -> str:
        text = self.tree
        start = text.find("{")
        while start >= 0:
            end, depth = start, 0
            while True:
                depth += {"{": 1, "}": -1}.get(text[end], 0)
                if not depth:
                    break
                end += 1
            own = [
                re.sub("=(?=[A-Z])", f"={side}", text[start + 1 : end].replace("@", mark).replace("$", mark[0]))
                for side, mark in zip(("left", "right"), self.sides, strict=True)
            ]
            text = text[:start] + "|".join(own) + text[end + 1 :]
            start = text.find("{")
        return text


def fingers(pattern: str, names: tuple[str, ...], numbers: tuple[object, ...]) -> str:
    """Fingers beside each other, the last one the little one: chains of a pattern with `<f>`, the name, and `<n>`, the
    number, the first three of which have roles.
    """
    return "|".join(
        ">".join(
            pattern.replace("<f>", name).replace("<n>", str(number)) + (f"={finger}{bone}" if bone < 4 else "")
            for bone, number in enumerate(numbers, start=1)
        )
        for finger, name in zip(FINGERS[-len(names) :], names, strict=True)
    )


FIVE = ("thumb", "index", "middle", "ring", "pinky")
FIVE_CAPITAL = ("Thumb", "Index", "Middle", "Ring", "Pinky")
FIVE_DAZ = ("Thumb", "Index", "Mid", "Ring", "Pinky")
LITTLE = ("Thumb", "Index", "Middle", "Ring", "Little")


def _metahuman_finger(finger: str, role: str) -> str:
    first, second, third = (f"{finger}_0{number}" for number in (1, 2, 3))
    return (
        f"{finger}_metacarpal_@={role}0({finger}_metacarpal_slide_@|{first}_@={role}1({first}_palm_@|{first}_mcp_@|"
        f"{first}_half_@({first}_side_inn_@|{first}_side_out_@|{first}_bulge_@|{first}_palmMid_@)|{second}_@={role}2("
        f"{second}_half_@({second}_pip_@|{second}_in_@|{second}_bulge_@|{second}_side_inn_@|{second}_side_out_@|"
        f"{second}_dip_@)|{third}_@={role}3({third}_half_@({third}_bulge_@|{third}_in_@)))))"
    )


METAHUMAN_HAND = "|".join(map(_metahuman_finger, FIVE[1:], FINGERS[1:])) + (
    "|thumb_metacarpal_slide_@|thumb_01_@=Thumb1(thumb_01_side_out_@|thumb_01_side_inn_@|thumb_02_@=Thumb2("
    "thumb_02_half_@|thumb_02_bulge_@|thumb_02_mcp_@|thumb_03_@=Thumb3(thumb_03_half_@|thumb_03_pip_@|thumb_03_bulge_@)"
    "))|wrist_inner_@|wrist_outer_@"
)
METAHUMAN = (
    "root>pelvis=hips(spine_01=spine>spine_02=spine>spine_03=spine>spine_04=spine>spine_05=spine({clavicle_@=Shoulder("
    "clavicle_out_@|clavicle_scap_@|upperarm_@=UpperArm(upperarm_correctiveRoot_@(upperarm_bck_@|upperarm_fwd_@|"
    "upperarm_in_@|"
    "upperarm_out_@)|upperarm_twist_01_@>upperarm_twistCor_01_@|upperarm_twist_02_@(upperarm_tricep_@|"
    "upperarm_bicep_@|upperarm_twistCor_02_@)|lowerarm_@=LowerArm(lowerarm_twist_02_@|lowerarm_twist_01_@|"
    "lowerarm_correctiveRoot_@(lowerarm_in_@|lowerarm_out_@|lowerarm_fwd_@|lowerarm_bck_@)|"
    f"hand_@=Hand({METAHUMAN_HAND}))))}}|"
    "{clavicle_pec_@|spine_04_latissimus_@}|neck_01=neck(FACIAL_C_Neck1Root({FACIAL_@_NeckB1|FACIAL_@_NeckBackB})|"
    "neck_02=neck(FACIAL_C_Neck2Root({FACIAL_@_NeckA1}|FACIAL_C_AdamsApple|FACIAL_C_NeckBackA)|"
    "head=head(FACIAL_C_FacialRoot({FACIAL_@_Eye(FACIAL_@_EyelidUpperA|FACIAL_@_EyeParallel)|FACIAL_@_Ear|"
    "FACIAL_@_12IPV_NeckA4}|"
    "FACIAL_C_Jaw>FACIAL_C_Chin1|FACIAL_C_Hair1|FACIAL_C_Forehead)))))|"
    "{thigh_@=UpperLeg(thigh_twist_01_@>thigh_twistCor_01_@|thigh_twist_02_@>thigh_twistCor_02_@|"
    "thigh_correctiveRoot_@("
    "thigh_fwd_@|thigh_bck_@|thigh_in_@|thigh_out_@|thigh_fwd_lwr_@|thigh_bck_lwr_@)|calf_@=LowerLeg(calf_twist_02_@>"
    "calf_twistCor_02_@|calf_twist_01_@|calf_correctiveRoot_@(calf_kneeBack_@|calf_knee_@)|foot_@=Foot(ankle_bck_@|"
    "ankle_fwd_@|ball_@=Toes(bigtoe_01_@>bigtoe_02_@|indextoe_01_@>indextoe_02_@|middletoe_01_@>middletoe_02_@|"
    "littletoe_01_@>littletoe_02_@))))})"
)

CHARACTER_CREATOR = (
    "CC_Base_BoneRoot>CC_Base_Hip=hips(CC_Base_Pelvis({CC_Base_@_Thigh=UpperLeg(CC_Base_@_ThighTwist01>"
    "CC_Base_@_ThighTwist02|CC_Base_@_Calf=LowerLeg(CC_Base_@_CalfTwist01>CC_Base_@_CalfTwist02|"
    "CC_Base_@_KneeShareBone|CC_Base_@_Foot=Foot(CC_Base_@_ToeBaseShareBone|CC_Base_@_ToeBase=Toes(CC_Base_@_BigToe1|"
    "CC_Base_@_IndexToe1|CC_Base_@_MidToe1))))})|CC_Base_Waist=spine>CC_Base_Spine01=spine>CC_Base_Spine02=spine("
    "{CC_Base_@_RibsTwist>CC_Base_@_Breast}|CC_Base_NeckTwist01=neck>CC_Base_NeckTwist02=neck>CC_Base_Head=head>"
    "CC_Base_FacialBone(CC_Base_JawRoot(CC_Base_Tongue01|CC_Base_Teeth02)|{CC_Base_@_Eye}|CC_Base_UpperJaw>"
    "CC_Base_Teeth01)|{CC_Base_@_Clavicle=Shoulder>CC_Base_@_Upperarm=UpperArm(CC_Base_@_Forearm=LowerArm("
    "CC_Base_@_ForearmTwist01>CC_Base_@_ForearmTwist02|CC_Base_@_ElbowShareBone|CC_Base_@_Hand=Hand("
    + fingers("CC_Base_@_<f><n>", FIVE_DAZ, (1, 2, 3))
    + "))|CC_Base_@_UpperarmTwist01>CC_Base_@_UpperarmTwist02)}))"
)

RIGS = {
    "MetaHuman": Rig(METAHUMAN, ("l", "r"), "Unreal Engine 5"),
    "Character Creator": Rig(CHARACTER_CREATOR, ("L", "R"), "Character Creator"),
    "3ds Max Biped": Rig(
        "Bip001>Bip001 Pelvis=hips>Bip001 Spine=spine({Bip001 @ Thigh=UpperLeg(Bip001 @ThighTwist|"
        "Bip001 @ Calf=LowerLeg>Bip001 @ Foot=Foot>Bip001 @ Toe0=Toes>Bip001 @ Toe0Nub)}|Bip001 Spine1=spine>"
        "Bip001 Spine2=spine>Bip001 Neck=neck(Bip001 Head=head>Bip001 HeadNub|{Bip001 @ Clavicle=Shoulder>"
        "Bip001 @ UpperArm=UpperArm(Bip001 @UpArmTwist|Bip001 @ Forearm=LowerArm(Bip001 @ ForeTwist>"
        "Bip001 @ ForeTwist1|Bip001 @ Hand=Hand("
        + "|".join(
            f"Bip001 @ Finger{n}={finger}1>Bip001 @ Finger{n}1={finger}2>Bip001 @ Finger{n}2={finger}3>"
            f"Bip001 @ Finger{n}Nub"
            for n, finger in enumerate(FINGERS)
        )
        + ")))}))",
        ("L", "R"),
        "3ds Max Biped",
    ),
    "Biped with underscores, legs on the pelvis": Rig(
        "Bip01>Bip01_Pelvis=hips({Bip01_@_Thigh=UpperLeg>Bip01_@_Calf=LowerLeg>Bip01_@_Foot=Foot>Bip01_@_Toe0=Toes}|"
        "Bip01_Spine=spine>Bip01_Spine1=spine>Bip01_Neck=neck(Bip01_Head=head(Bone_Hair01>Bone_Hair02)|{"
        "Bip01_@_Clavicle=Shoulder>Bip01_@_UpperArm=UpperArm>Bip01_@_Forearm=LowerArm>Bip01_@_Hand=Hand("
        "Bip01_@_Finger0=Thumb1>Bip01_@_Finger01=Thumb2|Bip01_@_Finger1=Index1>Bip01_@_Finger11=Index2)}))",
        ("L", "R"),
        "3ds Max Biped",
    ),
    "Ready Player Me": Rig(
        "Armature>Hips=hips(Spine=spine>Spine1=spine>Spine2=spine(Neck=neck>Head=head(HeadTop_End|LeftEye|RightEye)|{"
        "@Shoulder=Shoulder>@Arm=UpperArm>@ForeArm=LowerArm>@Hand=Hand("
        + fingers("@Hand<f><n>", FIVE_CAPITAL, (1, 2, 3, 4))
        + ")})|{@UpLeg=UpperLeg>@Leg=LowerLeg>@Foot=Foot>@ToeBase=Toes>@Toe_End})",
        ("Left", "Right"),
        "Mixamo",
    ),
    "VRoid": Rig(
        "Root(J_Bip_C_Hips=hips({J_Sec_@_SkirtBack0_01>J_Sec_@_SkirtBack1_01|J_Sec_@_CoatSkirtFront_01}|"
        "J_Bip_C_Spine=spine>J_Bip_C_Chest=spine>J_Bip_C_UpperChest=spine({J_Sec_@_Bust1>J_Sec_@_Bust2}|"
        "J_Bip_C_Neck=neck>J_Bip_C_Head=head({J_Adj_@_FaceEye}|J_Sec_Hair1_01>J_Sec_Hair2_01>J_Sec_Hair3_01|"
        "J_Sec_Hair1_02>J_Sec_Hair2_02|J_Sec_Hair1_03|J_Sec_Hair1_04|J_Sec_Hair1_05)|{J_Bip_@_Shoulder=Shoulder>"
        "J_Bip_@_UpperArm=UpperArm(J_Sec_@_TopsUpperArmInside_01|J_Bip_@_LowerArm=LowerArm>J_Bip_@_Hand=Hand("
        + fingers("J_Bip_@_<f><n>", LITTLE, (1, 2, 3))
        + "))})|{J_Bip_@_UpperLeg=UpperLeg>J_Bip_@_LowerLeg=LowerLeg>J_Bip_@_Foot=Foot>J_Bip_@_ToeBase=Toes})|Face|"
        "Body|Hair001)",
        ("L", "R"),
        "VRoid",
    ),
    "VRM's own names": Rig(
        "hips=hips(spine=spine>chest=spine>upperChest=spine(neck=neck>head=head(leftEye|rightEye|jaw)|{"
        "@Shoulder=Shoulder>@UpperArm=UpperArm>@LowerArm=LowerArm>@Hand=Hand(@ThumbMetacarpal=Thumb1>"
        "@ThumbProximal=Thumb2>@ThumbDistal=Thumb3|"
        + fingers("@<f><n>", LITTLE[1:], ("Proximal", "Intermediate", "Distal"))
        + ")})|{@UpperLeg=UpperLeg>@LowerLeg=LowerLeg>@Foot=Foot>@Toes=Toes})",
        ("left", "right"),
        "VRM",
    ),
    "Unity's names with spaces": Rig(
        "Hips=hips(Spine=spine>Chest=spine>Upper Chest=spine(Neck=neck>Head=head(Left Eye|Right Eye|Jaw)|{"
        "@ Shoulder=Shoulder>@ Upper Arm=UpperArm>@ Lower Arm=LowerArm>@ Hand=Hand("
        + fingers("@ <f> <n>", LITTLE, ("Proximal", "Intermediate", "Distal"))
        + ")})|{@ Upper Leg=UpperLeg>@ Lower Leg=LowerLeg>@ Foot=Foot>@ Toes=Toes})",
        ("Left", "Right"),
        "VRM",
    ),
    "Daz Genesis 8": Rig(
        "Genesis8Female>hip=hips(pelvis({@ThighBend=UpperLeg>@ThighTwist>@Shin=LowerLeg>@Foot=Foot(@Metatarsals|"
        "@Heel|@Toe=Toes(@BigToe>@BigToe_2|@SmallToe1>@SmallToe1_2))})|abdomenLower=spine>abdomenUpper=spine>"
        "chestLower=spine({@Pectoral}|chestUpper=spine(neckLower=neck>neckUpper=neck>head=head(upperTeeth|lowerJaw("
        "lowerTeeth|tongue01>tongue02)|{@Eye|@Ear}|lowerFaceRig>LipUpperMiddle)|{@Collar=Shoulder>"
        "@ShldrBend=UpperArm>@ShldrTwist>@ForearmBend=LowerArm>@ForearmTwist>@Hand=Hand(@Thumb1=Thumb1>"
        "@Thumb2=Thumb2>@Thumb3=Thumb3|@Carpal1=Index0>@Index1=Index1>@Index2=Index2>@Index3=Index3|@Carpal2=Middle0>"
        "@Mid1=Middle1>@Mid2=Middle2>@Mid3=Middle3|@Carpal3=Ring0>@Ring1=Ring1>@Ring2=Ring2>@Ring3=Ring3|"
        "@Carpal4=Little0>@Pinky1=Little1>@Pinky2=Little2>@Pinky3=Little3)})))",
        ("l", "r"),
        "Daz Genesis 3, 8",
    ),
    "Daz Genesis 9": Rig(
        "Genesis9>hip=hips(pelvis({@_thigh=UpperLeg(@_thightwist1|@_thightwist2|@_shin=LowerLeg>@_foot=Foot("
        "@_metatarsal|@_toes=Toes(@_bigtoe1>@_bigtoe2|@_indextoe1>@_indextoe2|@_midtoe1|@_ringtoe1|@_pinkytoe1)))})|"
        "spine1=spine>spine2=spine>spine3=spine({@_pectoral}|spine4=spine(neck1=neck>neck2=neck>head=head({@_eye|"
        "@_ear}|upperteeth|lowerjaw(lowerteeth|tongue01>tongue02)|lowerfacerig|upperfacerig)|{@_shoulder=Shoulder>"
        "@_upperarm=UpperArm(@_upperarmtwist1|@_upperarmtwist2|@_forearm=LowerArm(@_forearmtwist1|@_forearmtwist2|"
        "@_hand=Hand(@_thumb1=Thumb1>@_thumb2=Thumb2>@_thumb3=Thumb3|@_indexmetacarpal=Index0>@_index1=Index1>"
        "@_index2=Index2>@_index3=Index3|@_midmetacarpal=Middle0>@_mid1=Middle1>@_mid2=Middle2>@_mid3=Middle3|"
        "@_ringmetacarpal=Ring0>@_ring1=Ring1>@_ring2=Ring2>@_ring3=Ring3|@_pinkymetacarpal=Little0>@_pinky1=Little1>"
        "@_pinky2=Little2>@_pinky3=Little3)))})))",
        ("l", "r"),
        "Daz Genesis 9",
    ),
    "Second Life": Rig(
        "mPelvis=hips(PELVIS|BUTT|mSpine1=spine>mSpine2=spine>mTorso=spine(BELLY|LEFT_HANDLE|RIGHT_HANDLE|LOWER_BACK|"
        "mSpine3=spine>mSpine4=spine>mChest=spine(CHEST|LEFT_PEC|RIGHT_PEC|UPPER_BACK|mNeck=neck(NECK|mHead=head("
        "HEAD|mSkull|mEyeRight|mEyeLeft|mFaceRoot(mFaceJaw>mFaceTongueBase|mFaceTeethUpper>mFaceLipUpperLeft|"
        "mFaceEar1Left|mFaceEar1Right)))|{mCollar@=Shoulder($_CLAVICLE|mShoulder@=UpperArm($_UPPER_ARM|"
        "mElbow@=LowerArm($_LOWER_ARM|mWrist@=Hand($_HAND|"
        + fingers("mHand<f><n>@", FIVE_CAPITAL, (1, 2, 3))
        + "))))}|mWingsRoot({mWing1@>mWing2@>mWing3@>mWing4@})))|{mHip@=UpperLeg($_UPPER_LEG|mKnee@=LowerLeg("
        "$_LOWER_LEG|mAnkle@=Foot($_FOOT|mFoot@=Toes>mToe@)))}|mTail1>mTail2>mTail3|mGroin|mHindLimbsRoot({"
        "mHindLimb1@>mHindLimb2@>mHindLimb3@}))",
        ("Left", "Right"),
        "Second Life",
    ),
    "MikuMikuDance in English": Rig(
        "root>center(groove>waist=hips(upper body=spine>upper body2=spine(neck=neck>head=head({eye_@}|eyes|hair1>"
        "hair2)|{shoulderP_@>shoulder_@=Shoulder>shoulderC_@>arm_@=UpperArm(arm twist_@(arm twist1_@|arm twist2_@)|"
        "elbow_@=LowerArm(wrist twist_@|wrist_@=Hand(thumb0_@=Thumb1>thumb1_@=Thumb2>thumb2_@=Thumb3|fore1_@=Index1>"
        "fore2_@=Index2>fore3_@=Index3|middle1_@=Middle1>middle2_@=Middle2>middle3_@=Middle3|third1_@=Ring1>"
        "third2_@=Ring2>third3_@=Ring3|little1_@=Little1>little2_@=Little2>little3_@=Little3|dummy_@)))})|"
        "lower body({leg_@=UpperLeg>knee_@=LowerLeg>ankle_@=Foot>toe2_@=Toes}))|{leg IKP_@>leg IK_@>toe IK_@})",
        ("L", "R"),
        "MikuMikuDance, English",
    ),
    "VRChat avatars made of MMD models": Rig(
        "Hips=hips({@ leg=UpperLeg>@ knee=LowerLeg>@ ankle=Foot>@ toe=Toes}|Spine=spine>Chest=spine({"
        "@ shoulder=Shoulder>@ arm=UpperArm>@ elbow=LowerArm>@ wrist=Hand(Thumb0_$=Thumb1>Thumb1_$=Thumb2>"
        "Thumb2_$=Thumb3|IndexFinger1_$=Index1>IndexFinger2_$=Index2>IndexFinger3_$=Index3|MiddleFinger1_$=Middle1>"
        "MiddleFinger2_$=Middle2|RingFinger1_$=Ring1>RingFinger2_$=Ring2|LittleFinger1_$=Little1>"
        "LittleFinger2_$=Little2)}|Neck=neck>Head=head(Hair1>Hair2|Eye_L|Eye_R))|Skirt1)",
        ("Left", "Right"),
        "VRChat",
    ),
    "Rigify's metarig": Rig(
        "spine=hips(spine.001=spine>spine.002=spine>spine.003=spine(spine.004=neck>spine.005=neck>spine.006=head>"
        "face(nose|{eye.@|ear.@}|jaw>chin|teeth.T)|{shoulder.@=Shoulder>upper_arm.@=UpperArm>forearm.@=LowerArm>"
        "hand.@=Hand(palm.01.@=Index0(f_index.01.@=Index1>f_index.02.@=Index2>f_index.03.@=Index3|thumb.01.@=Thumb1>"
        "thumb.02.@=Thumb2>thumb.03.@=Thumb3)|palm.02.@=Middle0>f_middle.01.@=Middle1>f_middle.02.@=Middle2>"
        "f_middle.03.@=Middle3|palm.03.@=Ring0>f_ring.01.@=Ring1>f_ring.02.@=Ring2>f_ring.03.@=Ring3|"
        "palm.04.@=Little0>f_pinky.01.@=Little1>f_pinky.02.@=Little2>f_pinky.03.@=Little3)|breast.@})|{pelvis.@|"
        "thigh.@=UpperLeg>shin.@=LowerLeg>foot.@=Foot(toe.@=Toes|heel.02.@)})",
        ("L", "R"),
        "Rigify",
    ),
    "deforming bones alone, limbs in two": Rig(
        "root>DEF-spine=hips(DEF-spine.001=spine>DEF-spine.002=spine>DEF-spine.003=spine(DEF-spine.004=neck>"
        "DEF-spine.005=neck>DEF-spine.006=head|{DEF-shoulder.@=Shoulder>DEF-upper_arm.@=UpperArm>DEF-upper_arm.@.001>"
        "DEF-forearm.@=LowerArm>DEF-forearm.@.001>DEF-hand.@=Hand(DEF-palm.01.@=Index0(DEF-f_index.01.@=Index1>"
        "DEF-f_index.02.@=Index2>DEF-f_index.03.@=Index3|DEF-thumb.01.@=Thumb1>DEF-thumb.02.@=Thumb2>"
        "DEF-thumb.03.@=Thumb3)|DEF-palm.02.@=Middle0>DEF-f_middle.01.@=Middle1>DEF-f_middle.02.@=Middle2>"
        "DEF-f_middle.03.@=Middle3)|DEF-breast.@})|{DEF-pelvis.@|DEF-thigh.@=UpperLeg>DEF-thigh.@.001>"
        "DEF-shin.@=LowerLeg>DEF-shin.@.001>DEF-foot.@=Foot>DEF-toe.@=Toes})",
        ("L", "R"),
        "Rigify",
    ),
    "Rigify before 2019": Rig(
        "root>DEF-hips=hips(DEF-spine=spine>DEF-chest=spine(DEF-neck=neck>DEF-head=head|{DEF-shoulder.@=Shoulder>"
        "DEF-upper_arm.01.@=UpperArm>DEF-upper_arm.02.@>DEF-forearm.01.@=LowerArm>DEF-forearm.02.@>DEF-hand.@=Hand>"
        "DEF-palm.01.@=Index0>DEF-f_index.01.@=Index1>DEF-f_index.02.@=Index2})|{DEF-thigh.01.@=UpperLeg>"
        "DEF-thigh.02.@>DEF-shin.01.@=LowerLeg>DEF-shin.02.@>DEF-foot.@=Foot>DEF-toe.@=Toes})",
        ("L", "R"),
        "Rigify",
    ),
    "XNALara": Rig(
        "root ground>root hips=hips(pelvis({leg @ thigh=UpperLeg>leg @ knee=LowerLeg>leg @ ankle=Foot>leg @ toes=Toes})"
        "|spine lower=spine>spine middle=spine>spine upper=spine(head neck lower=neck>head neck upper=head(head jaw|"
        "head eyeball left|head eyeball right|head hair front)|{arm @ shoulder 1=Shoulder>arm @ shoulder 2=UpperArm("
        "arm @ shoulder 2 twist|arm @ elbow=LowerArm>arm @ wrist=Hand(arm @ finger 1a=Thumb1>arm @ finger 1b=Thumb2>"
        "arm @ finger 1c=Thumb3|arm @ finger 2a=Index1>arm @ finger 2b=Index2>arm @ finger 2c=Index3))}))",
        ("left", "right"),
        "XNALara",
    ),
    "VRoid under another program's prefix": Rig(
        "Hero_Root>Hero_J_Bip_C_Hips=hips(Hero_J_Bip_C_Spine=spine>Hero_J_Bip_C_Chest=spine(Hero_J_Bip_C_Neck=neck>"
        "Hero_J_Bip_C_Head=head|{Hero_J_Bip_@_Shoulder=Shoulder>Hero_J_Bip_@_UpperArm=UpperArm>"
        "Hero_J_Bip_@_LowerArm=LowerArm>Hero_J_Bip_@_Hand=Hand})|{Hero_J_Bip_@_UpperLeg=UpperLeg>"
        "Hero_J_Bip_@_LowerLeg=LowerLeg>Hero_J_Bip_@_Foot=Foot>Hero_J_Bip_@_ToeBase=Toes})",
        ("L", "R"),
        "VRoid",
    ),
    "Rigify for games, without dots": Rig(
        "root>DEF-hips=hips(DEF-spine001=spine>DEF-spine002=spine>DEF-spine003=spine(DEF-neck=neck>DEF-head=head|{"
        "DEF-shoulder@=Shoulder>DEF-upper_arm@=UpperArm>DEF-forearm@=LowerArm>DEF-hand@=Hand("
        + fingers("DEF-f_<f>0<n>@", FIVE[1:], (1, 2, 3))
        + "|DEF-thumb01@=Thumb1>DEF-thumb02@=Thumb2>DEF-thumb03@=Thumb3)})|{DEF-thigh@=UpperLeg>DEF-shin@=LowerLeg>"
        "DEF-foot@=Foot>DEF-toe@=Toes})",
        ("L", "R"),
        "Rigify",
    ),
    "Sketchfab's numbers": Rig(
        "_rootJoint>Hips_01=hips({thigh.@_076=UpperLeg>shin.@_077=LowerLeg>foot.@_078=Foot>toe.@_079=Toes>"
        "toe.@_end_0101}|Spine_02=spine>Chest_03=spine(Neck_04=neck>Head_05=head(Head_end_080|Hair_06>Hair.001_07)|{"
        "shoulder.@_032=Shoulder>upper_arm.@_00=UpperArm>forearm.@_034=LowerArm>hand.@_035=Hand("
        "thumb.01.@_038=Thumb1>thumb.02.@_039=Thumb2>thumb.02.@_end_081|f_index.01.@_036=Index1>"
        "f_index.02.@_00=Index2>f_index.03.@_037=Index3)}))",
        ("L", "R"),
    ),
    "Sketchfab's Mixamo": Rig(
        "_rootJoint>mixamorig:Hips_01=hips(mixamorig:Spine_02=spine>mixamorig:Spine1_03=spine>"
        "mixamorig:Spine2_04=spine(mixamorig:Neck_05=neck>mixamorig:Head_06=head>mixamorig:HeadTop_End_07|{"
        "mixamorig:@Shoulder_08=Shoulder>mixamorig:@Arm_00=UpperArm>mixamorig:@ForeArm_010=LowerArm>"
        "mixamorig:@Hand_011=Hand(mixamorig:@HandThumb1_012=Thumb1>mixamorig:@HandThumb2_013=Thumb2>"
        "mixamorig:@HandThumb3_014=Thumb3>mixamorig:@HandThumb4_015)})|{mixamorig:@UpLeg_055=UpperLeg>"
        "mixamorig:@Leg_056=LowerLeg>mixamorig:@Foot_057=Foot>mixamorig:@ToeBase_058=Toes>mixamorig:@Toe_End_059})",
        ("Left", "Right"),
        "Mixamo",
    ),
    "copied in Blender": Rig(
        "Hips.001=hips(Spine.001=spine>Chest.001=spine(Neck.001=neck>Head.001=head|{Shoulder.@.001=Shoulder>"
        "UpperArm.@.001=UpperArm>LowerArm.@.001=LowerArm>Hand.@.001=Hand(Index1.@.001=Index1>Index2.@.001=Index2>"
        "Index3.@.001=Index3)})|{UpperLeg.@.001=UpperLeg>LowerLeg.@.001=LowerLeg>Foot.@.001=Foot>Toes.@.001=Toes})",
        ("L", "R"),
        "VRM",
    ),
    "MikuMikuDance with bones that copy the legs": Rig(
        "全ての親>センター>グルーブ>腰=hips(上半身=spine>上半身2=spine(首=neck>頭=head({@目}|両目)|{@肩P>@肩=Shoulder>@肩C>@腕=UpperArm>@腕捩>"
        "@ひじ=LowerArm>@手捩>@手首=Hand(@親指０=Thumb1>@親指１=Thumb2>@親指２=Thumb3|@人指１=Index1>@人指２=Index2>@人指３=Index3|"
        "@中指１=Middle1>@中指２=Middle2>@中指３=Middle3)})|下半身({@足>@ひざ>@足首>@つま先|腰キャンセル@>@足D=UpperLeg>@ひざD=LowerLeg>@足首D=Foot>"
        "@足先EX=Toes}))",
        ("左", "右"),
        "MikuMikuDance",
    ),
    "a rigging service, its spine counted downwards": Rig(
        "Armature>Hips=hips(Spine02=spine>Spine01=spine>Spine=spine(neck=neck>Head=head(head_end|headfront)|{"
        "@Shoulder=Shoulder>@Arm=UpperArm>@ForeArm=LowerArm>@Hand=Hand})|{@UpLeg=UpperLeg>@Leg=LowerLeg>@Foot=Foot>"
        "@ToeBase=Toes})",
        ("Left", "Right"),
        "HumanIK (MotionBuilder)",
    ),
    "a rigging service with Character Creator's words": Rig(
        "Root>Hip=hips(Pelvis({@_Thigh=UpperLeg(@_ThighTwist01>@_ThighTwist02|@_Calf=LowerLeg(@_CalfTwist01|"
        "@_Foot=Foot>@_ToeBase=Toes))})|Waist=spine>Spine01=spine>Spine02=spine(NeckTwist01=neck>NeckTwist02=neck>"
        "Head=head|{@_Clavicle=Shoulder>@_Upperarm=UpperArm(@_UpperarmTwist01>@_UpperarmTwist02|@_Forearm=LowerArm("
        "@_ForearmTwist01|@_Hand=Hand))}))",
        ("L", "R"),
        "Character Creator",
    ),
    "KayKit": Rig(
        "Rig>root(hips=hips(spine=spine>chest=spine(head=head|{upperarm.@=UpperArm>lowerarm.@=LowerArm>wrist.@>"
        "hand.@=Hand>handslot.@})|{upperleg.@=UpperLeg>lowerleg.@=LowerLeg>foot.@=Foot>toes.@=Toes})|{kneeIK.@|"
        "control-toe-roll.@>control-heel-roll.@>control-foot-roll.@|IK-foot.@|IK-toe.@|elbowIK.@|handIK.@})",
        ("l", "r"),
    ),
}
